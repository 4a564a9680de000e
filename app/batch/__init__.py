"""Relocation of whole cohorts: many pairs of visits, resumable, on all cores or on a cluster. Knows no Qt.

The way of the data: `manifest` (what is asked) -> `run` (what is still to be done, one window at a time) ->
a `runners.Runner` (this process, or Dask workers) -> `work` (one pair, in the worker) -> `journal` and
``DIR/<case>.json`` (what is finished) -> `tables` (results.csv, cases.csv).
"""

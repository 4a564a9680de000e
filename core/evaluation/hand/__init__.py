"""Experiments of the hand application: scores, tables and pictures."""

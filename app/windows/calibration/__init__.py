"""Cameras and calibration: choose a camera, print the board, collect views, judge, save; the daily check."""

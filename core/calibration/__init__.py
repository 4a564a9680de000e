"""Calibration of a rig: boards, intrinsics, extrinsics, depth correction, verdict, daily check."""

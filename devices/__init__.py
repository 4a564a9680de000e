"""What sees the patient: cameras, recordings, the simulated patient, skeleton trackers."""

"""What leaves the clinic: reports and pictures."""

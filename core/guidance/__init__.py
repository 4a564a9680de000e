"""What the capture assistant knows: is this view good enough to capture, and what is to be corrected."""

"""Recordings of every form: made from any camera, opened as a row of frames, played as a live camera."""

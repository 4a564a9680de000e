"""The windows of a visit: stance, body capture, lesions, review. `VisitPage` is the door."""

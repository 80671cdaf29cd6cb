"""The walk frame by frame: every marker tracked through motion-blurred frames."""

"""From detections to 3D points, their errors and the error budget."""

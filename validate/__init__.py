"""Where prediction and measurement meet: detection, triangulation, tracking, statistics, and the command."""

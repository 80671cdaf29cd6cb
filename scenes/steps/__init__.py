"""What varies over a run: sweep files, schedule files, and the configurations they define."""

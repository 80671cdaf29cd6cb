"""What every run has in common: its files, messages, progress, exit codes and versions."""

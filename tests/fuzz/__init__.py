"""Fuzzing: random scenes and damaged files must render finite or be refused by name. `build.py fuzz` runs it long."""

"""Pictures: functions that take an Axes or make a Figure, and return it. The only importer of matplotlib."""

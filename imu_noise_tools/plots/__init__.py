"""Pictures: functions that take an Axes or make a Figure; the only importer of matplotlib."""

"""The live view: a process beside the flight that shows it in a browser and in Foxglove, and passes wishes on."""

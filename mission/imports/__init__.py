"""An autopilot's own log beside ours: PX4's ULog, ArduPilot's dataflash log, and telemetry logs."""

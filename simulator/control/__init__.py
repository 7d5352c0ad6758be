"""What moves the pumps: rules of the controller, drives, and the PLC that works by both."""

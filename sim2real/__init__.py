"""The gap between simulator and recording: where it lies, what causes it, how far it shrinks."""

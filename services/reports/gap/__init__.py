"""The gap between simulator and recording as page, pictures and lines of a terminal."""

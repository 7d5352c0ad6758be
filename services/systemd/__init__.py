"""What systemd needs: the unit files beside this one, and the word that a daemon lives."""

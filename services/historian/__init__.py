"""The historian: keeps what the bus says, and answers what was."""

"""Modbus TCP: the register table, server and client, and the PLCs that are polled."""

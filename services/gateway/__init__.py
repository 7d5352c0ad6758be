"""The gateway daemon: PLCs are polled over Modbus TCP, and what they measure is published as samples."""

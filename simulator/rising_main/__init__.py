"""The rising main: what flows in it in a second, and waves in a long one."""

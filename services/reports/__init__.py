"""What people read: pages, charts, tables on the terminal."""

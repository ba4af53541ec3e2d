"""Damaged files of every format, and what all readers owe to whoever has one."""

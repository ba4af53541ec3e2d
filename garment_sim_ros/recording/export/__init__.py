"""Recordings as files of other programs: one file here for each format, one reader of frames."""

"""Recordings of a station: files, files of other origins, figures."""

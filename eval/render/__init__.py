"""Rendering: tables, figures and colours."""

"""The report of a study, from its results alone: tables, text, figures, page."""

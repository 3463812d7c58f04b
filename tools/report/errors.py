"""What goes wrong in a way that the user can mend."""


class ReportError(Exception):
    """Its text says what is wrong, where, and what to do."""

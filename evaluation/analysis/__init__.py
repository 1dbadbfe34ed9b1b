"""Episodes read again, grouped for reports."""

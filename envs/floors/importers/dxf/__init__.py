"""Plans as DXF drawings."""

"""Outlines of what scans have seen, as bits that their edges toggle."""

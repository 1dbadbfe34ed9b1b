"""A run shown in a browser while it goes: what is drawn, its page, its controls, its pace."""

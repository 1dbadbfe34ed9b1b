"""What studies share: their interface, work that is kept, floors, figures."""

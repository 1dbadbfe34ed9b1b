"""Explorers that plan on predicted maps, and the predictors that they may use."""

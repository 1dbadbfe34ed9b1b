"""Compiled functions: their decorator and cache, views of arrays, vector operations, work for threads."""

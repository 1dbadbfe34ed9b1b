"""Maps of few boxes, made of point clouds by vector quantisation."""

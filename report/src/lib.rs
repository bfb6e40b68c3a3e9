//! One look for every HTML page and SVG plot.

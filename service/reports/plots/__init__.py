"""Small plots as SVG without any script: lines, points with error bars, cells of a map."""

"""How the page looks: A4, grey, colour for the alarm alone."""

STYLE = """
@page { size: A4 portrait; margin: 9mm 10mm; }
* { box-sizing: border-box; }
html { background: #fff; }
body { margin: 0 auto; max-width: 190mm; font: 8.2pt/1.3 "Liberation Sans", Arial, sans-serif;
  color: #222; }
header { display: flex; justify-content: space-between; align-items: baseline;
  border-bottom: 1.2pt solid #222; padding-bottom: 1mm; gap: 4mm; }
h1 { font-size: 13pt; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 8.6pt; margin: 1.6mm 0 .4mm; }
p { margin: .6mm 0; overflow-wrap: anywhere; }
.badge { font-weight: bold; padding: .4mm 2mm; border: 1.2pt solid #222; white-space: nowrap; }
.badge.alert { background: #ffd23f; }
.badge.danger { background: #c1121f; color: #fff; border-color: #c1121f; }
dl { display: grid; grid-template-columns: 18mm 1fr 18mm 1fr; gap: .3mm 2mm; margin: 1.4mm 0; }
dt { color: #666; }
dd { margin: 0; overflow-wrap: anywhere; }
.story { font-size: 9.2pt; }
.row { display: flex; gap: 3mm; align-items: flex-start; }
figure { margin: .8mm 0 0; flex: 1; min-width: 0; }
figcaption { font-size: 7.2pt; color: #444; line-height: 1.2; }
svg { display: block; width: 100%; height: auto; font: 9px "Liberation Sans", Arial, sans-serif;
  fill: #333; }
svg path { fill: none; }
.frame { stroke: #666; stroke-width: .8; }
.grid { stroke: #e3e3e3; stroke-width: .6; }
.mid { text-anchor: middle; }
.end { text-anchor: end; }
.note { font-size: 8px; fill: #555; }
svg .band { fill: #dcdcdc; stroke: none; }
.expected { stroke: #777; stroke-width: 1; stroke-dasharray: 4 2; }
.dots { stroke-linecap: round; stroke-width: 2; }
.member { stroke: #aaa; }
.unsettled { stroke: #ccc; stroke-width: 1.4; }
.today { stroke: #1f5fa8; fill: #1f5fa8; stroke-width: 1; }
.alarm { stroke: #c1121f; fill: #c1121f; stroke-width: 1.2; }
svg path.bar, svg path.at { fill: none; }
.at { stroke: #c1121f; stroke-width: 1; }
.marked { stroke: #888; stroke-width: .7; stroke-dasharray: 2 2; }
.shaft { stroke: #1f5fa8; stroke-width: .9; }
.bearing { stroke: #d07a00; stroke-width: .9; }
svg .known { fill: #1f5fa8; stroke: #fff; stroke-width: .5; }
svg .borrowed { fill: #1f5fa8; stroke: #555; stroke-width: .5; stroke-dasharray: 2 1.5; }
svg .unknown { fill: #fff; stroke: #bbb; stroke-width: .5; }
svg .own { stroke: #c1121f; stroke-width: 1.6; }
svg .strip { fill: #f3dcdc; stroke: none; }
table { border-collapse: collapse; width: 100%; font-size: 7.4pt; }
th, td { text-align: left; padding: .2mm 1.4mm .2mm 0; border-bottom: .4pt solid #ddd;
  vertical-align: top; overflow-wrap: anywhere; }
th { color: #555; font-weight: normal; }
td.n { font-variant-numeric: tabular-nums; }
footer { border-top: .6pt solid #888; margin-top: 1.4mm; padding-top: .8mm; font-size: 6.6pt;
  color: #555; overflow-wrap: anywhere; line-height: 1.25; }
@media screen { body { padding: 6mm; } }
"""

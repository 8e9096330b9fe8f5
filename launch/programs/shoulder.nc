(Open shoulder in the lower left corner of the demonstration mill's stock,)
(two levels of 1 mm, end mill of 19.05 mm; machine coordinates of the tool tip.)
(Feeds of 0.05 to 0.2 mm per tooth: Ktc and Kte are separable.)
N10 G90 G0 Z-150.
N20 G0 X-155. Y-85.
(friction of the spindle at a second speed)
N30 S9000 M3
N40 G4 X3.
N50 S4000 M3
N60 G4 X2.
N70 G0 Z-161.
(slot, 0.1 mm)
N80 G1 X-70. F1600.
N90 G0 Z-150.
N100 G0 X-155. Y-80.2375
N110 G0 Z-161.
(a quarter of the diameter, up-milling, 0.2 mm)
N120 G1 X-70. F3200.
N130 G1 Y-70.7125 F1600.
(half the diameter, down-milling, 0.1 mm)
N140 G1 X-155.
N150 G1 Y-64.3625
(a third, up-milling, 0.05 mm)
N160 G1 X-70. F800.
N170 G1 Y-59.6 F1600.
(a quarter, down-milling, 0.2 mm)
N180 G1 X-155. F3200.
N190 G0 Z-150.
N200 G0 X-155. Y-85.
N210 G0 Z-162.
(second level: slot, 0.15 mm)
N220 G1 X-70. F2400.
N230 G1 Y-75.475 F1600.
(half the diameter, down-milling, 0.1 mm)
N240 G1 X-155.
N250 G0 Z-150.
N260 M30

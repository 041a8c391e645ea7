-320.000000 -320.000000 -320.000000
320.000000 320.000000 320.000000
# no compensation: what `abbe export --format linuxcnc` makes goes here
# comments stand at the end: LinuxCNC stops reading at the first line without three numbers

# Source this after ROS 2: `ros2` then finds the package abbe.
AMENT_PREFIX_PATH='@PREFIX@'"${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}"
export AMENT_PREFIX_PATH

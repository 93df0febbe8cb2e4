"""What tandem knows as ROS 2 messages: CDR by the package rosbags, no ROS installation (extra `ros`)."""

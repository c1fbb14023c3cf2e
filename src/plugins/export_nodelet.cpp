/// Registers the nodelet with pluginlib, apart from the components: their users need no nodelets.
#include <pluginlib/class_list_macros.hpp>

#include "ros/variator_nodelet.h"

PLUGINLIB_EXPORT_CLASS(variator_sim::VariatorNodelet, nodelet::Nodelet)

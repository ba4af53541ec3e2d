// Prints stamp [ns] and mean_height of so many clouds: listener NAMESPACE TOPIC COUNT.
// `message_part.hpp` is cut out of docs/rviz.md. The middleware is asked by way of rcl, which
// rclcpp does too: rclcpp is not on the package index.
#include <cstdio>
#include <cstdlib>

#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosidl_typesupport_cpp/message_type_support.hpp>

#include "message_part.hpp"

static void check(rcl_ret_t result)
{
  if (result != RCL_RET_OK) {
    std::fprintf(stderr, "%s\n", rcl_get_error_string().str);
    std::exit(1);
  }
}

int main(int, char ** argv)
{
  const rcl_allocator_t allocator = rcl_get_default_allocator();
  rcl_init_options_t init_options = rcl_get_zero_initialized_init_options();
  check(rcl_init_options_init(&init_options, allocator));
  rcl_context_t context = rcl_get_zero_initialized_context();
  check(rcl_init(0, nullptr, &init_options, &context));
  rcl_node_t node = rcl_get_zero_initialized_node();
  const rcl_node_options_t node_options = rcl_node_get_default_options();
  check(rcl_node_init(&node, "cpp_listener", argv[1], &context, &node_options));
  rcl_subscription_t subscription = rcl_get_zero_initialized_subscription();
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos.depth = 2;
  const auto * type =
    rosidl_typesupport_cpp::get_message_type_support_handle<sensor_msgs::msg::PointCloud2>();
  check(rcl_subscription_init(&subscription, &node, type, argv[2], &options));
  rcl_wait_set_t waits = rcl_get_zero_initialized_wait_set();
  check(rcl_wait_set_init(&waits, 1, 0, 0, 0, 0, 0, &context, allocator));

  sensor_msgs::msg::PointCloud2 message;
  for (int left = std::atoi(argv[3]); left > 0;) {
    check(rcl_wait_set_clear(&waits));
    check(rcl_wait_set_add_subscription(&waits, &subscription, nullptr));
    check(rcl_wait(&waits, RCL_S_TO_NS(60)));
    const rcl_ret_t taken = rcl_take(&subscription, &message, nullptr, nullptr);
    if (taken != RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
      check(taken);
      const auto & stamp = message.header.stamp;
      const long long time = stamp.sec * 1000000000LL + stamp.nanosec;
      std::printf("%lld %.9f\n", time, mean_height(message));
      std::fflush(stdout);
      --left;
    }
  }
  return 0;
}

"""A context of `rclpy` for a part of a program."""

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions


def own_context() -> Context:
    """A context of its own; the program's command line is not looked at.

    Ctrl-C belongs to the program, which then shuts it down (`rclpy.shutdown(context=...)`).
    """
    context = Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    return context

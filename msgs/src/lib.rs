//! The wire: messages, services, actions, topics and QoS of Abbe.

//! What is resident, and when it is fetched.

mod load_on_entry;
mod movement;
mod movement_priority;
mod near_to_far_lru;

pub use load_on_entry::LoadOnEntry;
pub use movement_priority::MovementPriority;
pub use near_to_far_lru::NearToFarLru;

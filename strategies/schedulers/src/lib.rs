//! What is resident, and when it is fetched.

mod load_on_entry;

pub use load_on_entry::LoadOnEntry;

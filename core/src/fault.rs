//! What can go wrong in a stage.

/// Why a stage could not do its work. The caller that has the file, the line or the pipeline at hand adds it.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The request cannot be served, whatever is tried: settings contradict each other or do not fit the scene.
    #[error("{0}")]
    Refused(String),
    /// Stored or loaded data is not what it should be.
    #[error("{place}: {cause}")]
    Data {
        /// The file or block.
        place: String,
        /// What is wrong with it.
        cause: String,
    },
    /// The device or its driver failed.
    #[error("{device}: {cause}")]
    Device {
        /// The device's name.
        device: String,
        /// What it said.
        cause: String,
    },
    /// The caller asked for the work to stop.
    #[error("cancelled")]
    Cancelled,
}

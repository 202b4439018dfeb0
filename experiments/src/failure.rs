//! What the harness reports when it stops, and with which exit code.

use farfield_core::Fault;
use miette::Diagnostic;

use crate::config::mistakes::Mistakes;

/// Why an experiment stopped.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Failure {
    /// Mistakes in the experiment file.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Mistakes(#[from] Mistakes),
    /// The input is wrong: a file that is not what it should be, a request that cannot be served. Nothing was written.
    #[error("{what}")]
    #[diagnostic(help("{cause}"))]
    Input {
        /// What was attempted.
        what: String,
        /// Why it cannot be.
        cause: String,
    },
    /// The work failed.
    #[error("{what}")]
    #[diagnostic(help("{cause}"))]
    Work {
        /// What was attempted.
        what: String,
        /// Why it failed.
        cause: String,
    },
    /// The user stopped it.
    #[error("stopped")]
    #[diagnostic(help("what was built is stored: the same command goes on from there"))]
    Cancelled,
}

impl Failure {
    /// Wrong input.
    pub fn input(what: impl Into<String>, cause: impl ToString) -> Self {
        Self::Input { what: what.into(), cause: cause.to_string() }
    }

    /// Work that failed.
    pub fn work(what: impl Into<String>, cause: impl ToString) -> Self {
        Self::Work { what: what.into(), cause: cause.to_string() }
    }

    /// A fault of a stage before anything is written: a refusal is then wrong input.
    pub fn before(what: impl Into<String>, fault: Fault) -> Self {
        match fault {
            Fault::Cancelled => Self::Cancelled,
            Fault::Refused(cause) => Self::input(what, cause),
            other => Self::work(what, other),
        }
    }

    /// A fault of a stage at work.
    pub fn during(what: impl Into<String>, fault: Fault) -> Self {
        match fault {
            Fault::Cancelled => Self::Cancelled,
            other => Self::work(what, other),
        }
    }

    /// 2 for wrong input, 1 for failed work.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Mistakes(_) | Self::Input { .. } => 2,
            Self::Work { .. } | Self::Cancelled => 1,
        }
    }
}

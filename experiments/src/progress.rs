//! Progress bars on a terminal; nothing elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Where progress goes.
pub struct Progress {
    quiet: bool,
}

/// One bar; the default is not drawn.
pub struct Bar(ProgressBar);

impl Default for Bar {
    fn default() -> Self {
        Self(ProgressBar::hidden())
    }
}

impl Progress {
    /// On standard error if it is a terminal, unless `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// A bar over a pipeline's cells.
    pub fn cells(&self, pipeline: &str, n: usize) -> Bar {
        self.bar(format!("building {pipeline}"), "cells", n)
    }

    /// What a pipeline's scene-wide bake has stored; how much there will be is not known.
    pub fn scene(&self, pipeline: &str) -> Bar {
        if self.quiet {
            return Bar::default();
        }
        let bar = ProgressBar::no_length().with_message(format!("building {pipeline}, whole scene"));
        let style = ProgressStyle::with_template("{msg:40!} {pos} payloads stored, {elapsed}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Bar(bar)
    }

    /// A bar over a pipeline's frames.
    pub fn frames(&self, pipeline: &str, n: usize) -> Bar {
        self.bar(format!("walking {pipeline}"), "frames", n)
    }

    /// A bar over a pipeline's samples.
    pub fn samples(&self, pipeline: &str, n: usize) -> Bar {
        self.bar(format!("sampling {pipeline}"), "samples", n)
    }

    fn bar(&self, what: String, unit: &str, n: usize) -> Bar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let style = format!("{{msg:40!}} [{{bar:30}}] {{pos}}/{{len}} {unit}, {{eta}} left");
        let bar = ProgressBar::with_draw_target(Some(n as u64), target).with_message(what);
        bar.set_style(ProgressStyle::with_template(&style).unwrap_or_else(|_| ProgressStyle::default_bar()));
        Bar(bar)
    }
}

impl Bar {
    /// One more is done.
    pub fn inc(&self) {
        self.0.inc(1);
    }

    /// All are.
    pub fn done(&self) {
        self.0.finish_and_clear();
    }
}

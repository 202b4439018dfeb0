//! Mistakes in an experiment file: collected, and shown all at once, each with file, line and column of the very key.

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

use super::node::At;

/// The texts that an experiment is read from, with their names.
#[derive(Clone, Debug)]
pub(super) struct Sources(pub(super) Vec<(String, String)>);

/// One mistake.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct Mistake {
    message: String,
    help: Option<String>,
    label: String,
    span: std::ops::Range<usize>,
    text: NamedSource<String>,
    /// Line and column, from 1; the column counts characters.
    pub line_column: (usize, usize),
    /// The file or argument.
    pub file: String,
}

impl Diagnostic for Mistake {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.help.as_ref().map(|h| Box::new(h) as Box<dyn std::fmt::Display>)
    }
    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.text)
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = LabeledSpan::new(Some(self.label.clone()), self.span.start, self.span.len());
        Some(Box::new(std::iter::once(span)))
    }
}

/// All mistakes of an experiment.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{}", count(.all))]
pub struct Mistakes {
    /// One each.
    #[related]
    pub all: Vec<Mistake>,
}

fn count(all: &[Mistake]) -> String {
    let file = all.first().map_or("", |m| m.file.as_str());
    if all.len() == 1 { format!("a mistake in {file}") } else { format!("{} mistakes in {file}", all.len()) }
}

/// Collects mistakes while an experiment is walked.
pub(super) struct Collector<'a> {
    sources: &'a Sources,
    found: Vec<(At, Mistake)>,
}

impl<'a> Collector<'a> {
    /// None yet.
    pub(super) fn new(sources: &'a Sources) -> Self {
        Self { sources, found: vec![] }
    }

    /// Notes a mistake at a place; `label` stands under the place, `help` lists choices or a way out.
    pub(super) fn add(&mut self, at: &At, message: impl Into<String>, label: impl Into<String>, help: Option<String>) {
        let (name, text) = &self.sources.0[at.source];
        let start = at.span.start.min(text.len());
        let before = &text[..text.floor_char_boundary(start)];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        let message = message.into();
        let mistake = Mistake {
            message: format!("{name}:{line}:{column}: {message}"),
            help,
            label: label.into(),
            span: start..at.span.end.clamp(start, text.len()),
            text: NamedSource::new(name, text.clone()).with_language("TOML"),
            line_column: (line, column),
            file: name.clone(),
        };
        // A swept pipeline is walked once a value: what is wrong in its table is wrong once.
        if !self.found.iter().any(|(a, m)| a == at && m.message == mistake.message) {
            self.found.push((at.clone(), mistake));
        }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// All of them, in the order of the text.
    pub(super) fn finish(mut self) -> Result<(), Mistakes> {
        self.found.sort_by_key(|(at, _)| (at.source, at.span.start));
        let all: Vec<Mistake> = self.found.into_iter().map(|(_, m)| m).collect();
        if all.is_empty() { Ok(()) } else { Err(Mistakes { all }) }
    }
}

/// The choice that is nearest to what was written, when it is near enough to be meant.
pub(super) fn nearest<'a>(written: &str, choices: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let best = choices.into_iter().map(|c| (distance(written, c), c)).min_by_key(|(d, _)| *d)?;
    (best.0 <= written.chars().count().max(3) / 3).then_some(best.1)
}

/// Levenshtein distance. O(n m).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let next = (diagonal + usize::from(x != y)).min(row[j] + 1).min(row[j + 1] + 1);
            diagonal = std::mem::replace(&mut row[j + 1], next);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_choice_is_offered_only_when_it_is_near() {
        assert_eq!(nearest("edg_px", ["edge_px", "max_px"]), Some("edge_px"));
        assert_eq!(nearest("speed", ["edge_px", "max_px"]), None);
        assert_eq!((distance("kitten", "sitting"), distance("", "abc")), (3, 3));
    }
}

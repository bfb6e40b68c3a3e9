//! The output files of a command, with the HTML pages among them, which state how they were made.
//!
//! Files are written by [`recording::outputs`]: all or none, and no user's file is overwritten.

use std::path::{Path, PathBuf};

use recording::outputs::{self, WriteError};
use report::InputFile;

use crate::provenance::{self, Invocation};

/// The files of one command.
#[derive(Debug, Default)]
pub struct Outputs {
    files: outputs::Outputs,
    /// Pages, and whether they have their content.
    pages: Vec<(PathBuf, bool)>,
    /// The program run that is stated on the pages.
    invocation: Invocation,
    /// What was read, as its pages name it.
    read: Vec<InputFile>,
}

impl Outputs {
    /// No file yet; `may_replace` is `--overwrite`.
    #[must_use]
    pub fn new(may_replace: bool) -> Self {
        Self { files: outputs::Outputs::new(may_replace), ..Self::default() }
    }

    /// Sets the program run that is stated on the pages among the outputs.
    #[must_use]
    pub fn with_invocation(self, invocation: Invocation) -> Self {
        Self { invocation, ..self }
    }

    /// As [`outputs::Outputs::in_folder`].
    #[must_use]
    pub fn in_folder(self, folder: &Path) -> Self {
        Self { files: self.files.in_folder(folder), ..self }
    }

    /// As [`outputs::Outputs::file`].
    #[must_use]
    pub fn file(self, path: impl Into<PathBuf>) -> Self {
        Self { files: self.files.file(path), ..self }
    }

    /// As [`outputs::Outputs::result`].
    #[must_use]
    pub fn result(self, path: impl Into<PathBuf>) -> Self {
        Self { files: self.files.result(path), ..self }
    }

    /// Announces a page, which is a result; the files that are read are then hashed by [`Outputs::check`], before anything is computed of them.
    #[must_use]
    pub fn page(mut self, path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        self.pages.push((path.clone(), false));
        self.result(path)
    }

    /// Announces optional results.
    #[must_use]
    pub fn pages<'a>(self, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        paths.into_iter().fold(self, Self::page)
    }

    /// As [`outputs::Outputs::put`].
    pub fn put(&mut self, path: &Path, bytes: impl Into<Vec<u8>>) {
        self.files.put(path, bytes);
    }

    /// Sets the content of a page, including the section that states how it was made.
    pub fn put_page(&mut self, path: &Path, page: report::Page) {
        let made = self.invocation.provenance(self.read.clone());
        self.put(path, page.provenance(made).render());
        match self.pages.iter_mut().find(|(page, _)| page == path) {
            Some((_, is_written)) => *is_written = true,
            None => self.pages.push((path.to_owned(), true)),
        }
    }

    /// Pages that have their content.
    pub(crate) fn written_pages(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.pages.iter().filter(|(_, is_written)| *is_written).map(|(path, _)| path.clone())
    }

    /// As [`outputs::Outputs::check`].
    ///
    /// # Errors
    /// As [`Outputs::write`].
    pub fn check<'a>(
        &mut self,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<(), WriteError> {
        let new = self.files.check(inputs)?;
        if !self.pages.is_empty() {
            self.read.extend(new.iter().filter_map(|input| provenance::hashed(input)));
        }
        Ok(())
    }

    /// As [`outputs::Outputs::write`].
    ///
    /// # Errors
    /// A file that exists, a directory that does not, or an error of the operating system.
    pub fn write(self) -> Result<(), WriteError> {
        self.files.write()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pages_and_plots_take_the_place_of_earlier_ones_and_of_nothing_else() {
        let path = std::env::temp_dir().join(format!("trued-pages-{}", std::process::id()));
        let again = || {
            let mut outputs = Outputs::default().page(&path);
            outputs.put_page(&path, report::Page::new("a later page"));
            outputs.write()
        };
        let page = report::Page::new("a page").render();
        let (t, e) = (report::Axis::new("t", "s"), report::Axis::new("e", "mm"));
        let line = report::Series::line("l", [(0.0, 0.0), (1.0, 1.0)]);
        let plot = report::Plot::new("p", t, e).series(line).render().file();
        for ours in [page, plot] {
            fs::write(&path, ours).expect("written");
            again().expect("made anew");
            assert!(fs::read_to_string(&path).expect("read").contains("a later page"));
        }
        fs::write(&path, "<!DOCTYPE html>\n<html>").expect("written");
        let refused = again();
        fs::remove_file(&path).expect("removed");
        assert!(matches!(refused, Err(WriteError::Exists(_))), "{refused:?}");
    }
}

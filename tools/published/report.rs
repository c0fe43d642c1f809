//! What a part of the report says, as text and as a section of a web page.
use tallow::image::Picture;
use tallow::report::html::viewer::{Image, Viewer};
use tallow::report::html::{Section as PageSection, Table};

/// The tables and pictures of a part.
#[derive(Default)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// What is compared, with which stand-ins, and what falls short.
    pub texts: Vec<String>,
    /// Ours beside the published figures.
    pub tables: Vec<Table>,
    /// Images that belong together.
    pub sheets: Vec<Sheet>,
}

/// Images of one scene and its reference.
pub struct Sheet {
    /// Scene and samples.
    pub name: String,
    /// Name and image.
    pub images: Vec<(String, Picture)>,
    /// What the images should be.
    pub reference: Picture,
}

impl Section {
    /// A section with nothing in it.
    pub fn new(title: &str, texts: &[&str]) -> Self {
        let texts = texts.iter().map(|&text| text.to_owned()).collect();
        Self { title: title.to_owned(), texts, ..Self::default() }
    }

    /// As Markdown.
    pub fn text(&self) -> String {
        let texts = self.texts.iter().map(|text| format!("{text}\n\n"));
        let tables = self.tables.iter().map(markdown);
        format!("## {}\n\n{}{}", self.title, texts.collect::<String>(), tables.collect::<String>())
    }

    /// As a part of a page.
    pub fn html(&self) -> PageSection<'_> {
        let viewers = self.sheets.iter().map(Sheet::viewer).collect();
        PageSection { title: self.title.clone(), texts: self.texts.clone(), viewers, tables: self.tables.clone() }
    }
}

impl Sheet {
    fn viewer(&self) -> Viewer<'_> {
        let numbered = self.images.iter().zip(1..);
        let mut images: Vec<_> = numbered
            .map(|((name, picture), rank)| Image { name: name.clone(), caption: self.name.clone(), picture, rank })
            .collect();
        let (name, caption) = ("reference".to_owned(), self.name.clone());
        images.push(Image { name, caption, picture: &self.reference, rank: 0 });
        Viewer { group: self.name.clone(), reference: Some(images.len() - 1), images }
    }
}

fn markdown(table: &Table) -> String {
    let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let rows = table.rows.iter().map(|row| line(row.cells.iter().map(|cell| cell.text.as_str()).collect()));
    let title = if table.title.is_empty() { String::new() } else { format!("{}\n\n", table.title) };
    let note = if table.note.is_empty() { String::new() } else { format!("{}\n\n", table.note) };
    let head = line(table.header.iter().map(String::as_str).collect()) + &line(vec!["---"; table.header.len()]);
    format!("{title}{note}{head}{}\n", rows.collect::<String>())
}

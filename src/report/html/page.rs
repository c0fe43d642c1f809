//! Pages of sections with texts, tables and images.
use super::Frame;
use super::viewer::Viewer;
use askama::Template;

/// A page for any report. All texts are escaped.
///
/// ```
/// use tallow::image::Picture;
/// use tallow::report::html::viewer::{Image, Viewer};
/// use tallow::report::html::{Cell, Page, Section, Table};
///
/// let picture = Picture { width: 1, height: 1, pixels: vec![[0.5; 3]] };
/// let image = |name: &str| Image { name: name.into(), caption: String::new(), picture: &picture, rank: 0 };
/// let viewer = Viewer { group: "all".into(), images: vec![image("a.exr"), image("b.exr")], reference: Some(1) };
/// let mut table = Table::new("Metrics", &["metric", "value"]);
/// table.push(vec![Cell::text("MSE"), Cell::number(0.0)]);
/// let texts = vec!["No block differs by more than its noise.".into()];
/// let section = Section { title: String::new(), texts, viewers: vec![viewer], tables: vec![table] };
/// let page = Page {
///     title: "a.exr against b.exr".into(),
///     facts: vec![("verdict".into(), "same".into())],
///     sections: vec![section],
/// };
/// assert!(page.html().contains("<h2>Metrics</h2>"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// Title of the page and its first heading.
    pub title: String,
    /// Short facts below the title: name and value.
    pub facts: Vec<(String, String)>,
    /// What follows, in this order.
    pub sections: Vec<Section<'a>>,
}

/// A part of a [`Page`].
#[derive(Clone, Debug, Default)]
pub struct Section<'a> {
    /// Heading; may be empty.
    pub title: String,
    /// Paragraphs.
    pub texts: Vec<String>,
    /// Viewers of images.
    pub viewers: Vec<Viewer<'a>>,
    /// Tables.
    pub tables: Vec<Table>,
}

/// A table that readers sort by a click on a column's name.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Heading; may be empty.
    pub title: String,
    /// A sentence below the heading; may be empty.
    pub note: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// The rows, in the order that readers see first.
    pub rows: Vec<Row>,
}

/// One row of a [`Table`].
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// The cells, one for each name in the header.
    pub cells: Vec<Cell>,
    /// Name of the image that a click on the row shows in the viewers.
    pub image: Option<String>,
    /// Whether the row is emphasised.
    pub strong: bool,
}

/// One cell of a [`Table`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// What it says below that in small print; may be empty.
    pub small: String,
    /// The number that rows are sorted by; `None` sorts by the text, behind all numbers.
    pub value: Option<f64>,
}

impl Page<'_> {
    /// The page as the content of a file.
    pub fn html(&self) -> String {
        PlainPage { frame: Frame::new(&self.title), page: self }.to_string()
    }
}

impl Section<'_> {
    /// Level of the headings of its tables.
    fn heading(&self) -> &'static str {
        if self.title.is_empty() { "h2" } else { "h3" }
    }

    fn viewers(&self) -> Vec<String> {
        self.viewers.iter().map(Viewer::html).collect()
    }
}

impl Table {
    /// An empty table of this title and these columns.
    pub fn new(title: &str, header: &[&str]) -> Self {
        let header = header.iter().map(|&name| name.to_owned()).collect();
        Self { title: title.to_owned(), header, ..Self::default() }
    }

    /// Adds a row that shows no image.
    pub fn push(&mut self, cells: Vec<Cell>) {
        self.rows.push(Row { cells, ..Row::default() });
    }
}

impl Cell {
    /// A cell of text.
    pub fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), ..Self::default() }
    }

    /// A number with three digits; one that is not finite is a dash.
    pub fn number(value: f64) -> Self {
        Self { text: super::number::short(value), small: String::new(), value: Some(value) }
    }

    /// The number that rows are sorted by, if it is finite.
    pub(super) fn order(&self) -> Option<f64> {
        self.value.filter(|value| value.is_finite())
    }
}

/// What `plain_page.html` shows.
#[derive(Template)]
#[template(path = "plain_page.html", config = "src/report/html/askama.toml")]
struct PlainPage<'a> {
    frame: Frame<'a>,
    page: &'a Page<'a>,
}

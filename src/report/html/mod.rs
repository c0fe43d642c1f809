//! Reports as web pages. A page is one file that opens from disk: styles, scripts, plots and pixels are in it, it asks nothing of
//! the network, and without scripts it still shows every plot, table and image.
//!
//! - [`cost()`] is the page of a cost measurement.
//! - [`Page`] is a page of texts, tables and images for everything else, such as a comparison.
//! - [`viewer`] is what shows images in both.
mod changes;
mod chart;
mod cost;
mod error_chart;
mod number;
mod page;
mod pass_chart;
mod pass_table;
mod pixels;
mod point_table;
pub mod viewer;

pub use cost::cost;
pub use page::{Cell, Page, Row, Section, Table};

/// What stands around the content of every page; the template is `page.html`.
struct Frame<'a> {
    title: &'a str,
    style: &'static str,
    /// Each is a block of its own, so that its names are.
    scripts: [&'static str; 2],
}

impl<'a> Frame<'a> {
    fn new(title: &'a str) -> Self {
        let viewer = concat!(include_str!("pixels.js"), include_str!("panes.js"), include_str!("viewer.js"));
        Self { title, style: include_str!("style.css"), scripts: [include_str!("page.js"), viewer] }
    }
}

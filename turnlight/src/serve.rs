//! A site on loopback: just enough of HTTP/1.1 (RFC 9112) for a browser on the same machine.
//!
//! The server knows the files of one [`Site`] by name and touches no other: no path reaches the disk. It listens on
//! 127.0.0.1 alone, answers GET alone, and only requests that name it as their host, so that a foreign page that a
//! browser has open cannot read the model by pointing a name of its own at this machine (DNS rebinding).

use crate::Error;
use crate::export::web::{Site, SiteFile};
use render::web::PAGE;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Longest request that is read; browsers send a few hundred bytes.
const MOST_REQUEST_BYTES: usize = 16 << 10;

/// How long a browser may be silent.
const PATIENCE: Duration = Duration::from_secs(10);

/// Browsers open six connections at once; more than a few of them mean mischief.
const MOST_CONNECTIONS: usize = 32;

/// A bound server that does not answer yet.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    site: Arc<Site>,
}

/// What is sent back.
struct Response<'a> {
    status: &'static str,
    media_type: &'static str,
    body: &'a [u8],
}

impl Server {
    /// Binds to `port` of 127.0.0.1; 0 takes any free one.
    ///
    /// # Errors
    /// Where the port is taken or not allowed.
    pub fn bind(site: Site, port: u16) -> Result<Self, Error> {
        let fault = |fault| Error::Failed(format!("port {port} of 127.0.0.1: {fault}; choose another with --port"));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(fault)?;
        let address = listener.local_addr().map_err(fault)?;
        Ok(Self { listener, address, site: Arc::new(site) })
    }

    /// The address of the page.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Answers requests until the process ends.
    pub fn run(&self) {
        let open = Arc::new(AtomicUsize::new(0));
        for stream in self.listener.incoming() {
            // A connection that went away before it was taken is nobody's fault.
            let Ok(stream) = stream else { continue };
            if open.load(Ordering::Relaxed) >= MOST_CONNECTIONS {
                continue;
            }
            open.fetch_add(1, Ordering::Relaxed);
            let (site, port, open) = (Arc::clone(&self.site), self.address.port(), Arc::clone(&open));
            std::thread::spawn(move || {
                // A browser that hangs up is nobody's fault either.
                let _ = answer(&stream, &site, port);
                open.fetch_sub(1, Ordering::Relaxed);
            });
        }
    }
}

fn answer(mut stream: &TcpStream, site: &Site, port: u16) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let head = read_head(stream)?;
    let response = respond(&head, site, port);
    let head = format!(
        "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n{}\r\n",
        response.status,
        response.media_type,
        response.body.len(),
        if response.status.starts_with("405") { "Allow: GET\r\n" } else { "" },
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(response.body)?;
    stream.flush()
}

/// Reads up to the empty line that ends the head of a request; what follows is left alone.
fn read_head(mut stream: impl Read) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut part = [0; 1024];
    while !head.windows(4).any(|w| w == b"\r\n\r\n") && head.len() < MOST_REQUEST_BYTES {
        match stream.read(&mut part)? {
            0 => break,
            n => head.extend_from_slice(&part[..n]),
        }
    }
    Ok(head)
}

fn respond<'a>(head: &[u8], site: &'a Site, port: u16) -> Response<'a> {
    let refused = |status: &'static str| Response { status, media_type: "text/plain", body: status.as_bytes() };
    let Some((method, path, host)) = parse(head) else { return refused("400 Bad Request") };
    if host != format!("127.0.0.1:{port}") && host != format!("localhost:{port}") {
        return refused("403 Forbidden");
    }
    if method != "GET" {
        return refused("405 Method Not Allowed");
    }
    match find(path, site) {
        Some(file) => Response { status: "200 OK", media_type: file.media_type, body: &file.bytes },
        None => refused("404 Not Found"),
    }
}

/// Method, target and host of a request.
fn parse(head: &[u8]) -> Option<(&str, &str, &str)> {
    let end = head.windows(4).position(|w| w == b"\r\n\r\n")?;
    let mut lines = std::str::from_utf8(&head[..end]).ok()?.split("\r\n");
    let mut first = lines.next()?.split(' ');
    let (method, target, version) = (first.next()?, first.next()?, first.next()?);
    let is_host = |line: &&str| line.split_once(':').is_some_and(|(name, _)| name.eq_ignore_ascii_case("host"));
    let mut hosts = lines.filter(is_host);
    let (_, host) = hosts.next()?.split_once(':')?;
    let is_sound = version.starts_with("HTTP/1.") && first.next().is_none() && hosts.next().is_none();
    is_sound.then_some((method, target, host.trim()))
}

/// The file of exactly this name; the page where none is named.
fn find<'a>(target: &str, site: &'a Site) -> Option<&'a SiteFile> {
    let path = target.split('?').next()?.strip_prefix('/')?;
    let path = if path.is_empty() { PAGE } else { path };
    site.files.iter().find(|file| file.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(request: &str) -> String {
        respond(request.as_bytes(), &Site::new(b"glTF".to_vec()), 80).status.to_owned()
    }

    fn get(target: &str) -> String {
        status(&format!("GET {target} HTTP/1.1\r\nHost: 127.0.0.1:80\r\n\r\n"))
    }

    #[test]
    fn files_of_the_site_are_served_and_nothing_else() {
        for target in ["/", "/index.html", "/?camera=%7B%7D", "/model.glb", "/vendor/three.min.js"] {
            assert_eq!(get(target), "200 OK", "{target}");
        }
        for target in [
            "/../Cargo.toml",
            "/vendor/../../etc/passwd",
            "/%2e%2e/Cargo.toml",
            "//etc/passwd",
            "/etc/passwd",
            "/.turnlight",
            "/vendor/",
            "/vendor",
            "/MODEL.GLB",
            "/model.glb/",
            "/index.html%00.js",
            "model.glb",
            "http://127.0.0.1/",
            "*",
        ] {
            assert_eq!(get(target), "404 Not Found", "{target}");
        }
    }

    #[test]
    fn only_get_is_answered_and_only_to_this_host() {
        for method in ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "get"] {
            let request = format!("{method} / HTTP/1.1\r\nHost: localhost:80\r\n\r\n");
            assert_eq!(status(&request), "405 Method Not Allowed", "{method}");
        }
        for host in ["evil.example", "evil.example:80", "127.0.0.1", "localhost:81", "127.0.0.1:80.evil.example", ""] {
            assert_eq!(status(&format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n")), "403 Forbidden", "{host}");
        }
    }

    #[test]
    fn broken_requests_are_refused() {
        for request in [
            "",
            "\r\n\r\n",
            "GET / HTTP/1.1\r\n\r\n",
            "GET /\r\nHost: localhost:80\r\n\r\n",
            "GET / HTTP/1.1 x\r\nHost: localhost:80\r\n\r\n",
            "GET / HTTP/1.1\r\nHost: localhost:80\r\nHost: evil.example\r\n\r\n",
            "GET / HTTP/1.1\r\nHost: localhost:80",
            "\u{16}\u{3}\u{1} TLS \r\n\r\n",
        ] {
            assert_eq!(status(request), "400 Bad Request", "{request:?}");
        }
    }

    #[test]
    fn endless_requests_end() {
        assert!(read_head(io::repeat(b'x')).unwrap().len() <= MOST_REQUEST_BYTES + 1024);
    }

    #[test]
    fn a_browser_gets_the_model_over_loopback() {
        let server = Server::bind(Site::new(b"glTF and so on".to_vec()), 0).unwrap();
        let address = server.address;
        assert!(address.ip().is_loopback());
        std::thread::spawn(move || server.run());
        let mut stream = TcpStream::connect(address).unwrap();
        write!(stream, "GET /model.glb HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\nContent-Type: model/gltf-binary\r\nContent-Length: 14\r\n"));
        assert!(answer.ends_with("\r\n\r\nglTF and so on"), "{answer}");
    }
}

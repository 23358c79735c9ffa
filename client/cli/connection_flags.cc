#include "client/cli/connection_flags.h"

#include <cstddef>
#include <optional>

#include <CLI/CLI.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "client/cli/option_support.h"
#include "client/files/text_file.h"
#include "core/base/host_port.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kEnvironmentKey[] = "ISOMATCH_API_KEY";

// What CLI11 tells the user about a --server that is none; empty when it is.
std::string CheckAddress(const std::string& address);

// The same of several addresses, of which the first that answers is taken.
std::string CheckAddresses(const std::string& addresses) {
  for (const absl::string_view part : absl::StrSplit(addresses, ',')) {
    const std::optional<HostPort> parts = ParseHostPort(std::string(part));
    const bool is_ipv4 = parts && parts->host.find_first_not_of(
                                      "0123456789.") == std::string::npos;
    if (is_ipv4 && parts->port > 0) continue;
    return absl::StrCat("'", part, "' of '", addresses,
                        "', expected IP:PORT where there are several; a name "
                        "may stand for several machines by itself");
  }
  return "";
}

std::string CheckAddress(const std::string& address) {
  if (absl::StartsWith(address, "unix:")) return "";
  if (absl::StrContains(address, ",")) return CheckAddresses(address);
  const std::size_t scheme = address.find("://");
  if (scheme != std::string::npos) {
    return absl::StrCat("'", address, "', expected HOST:PORT without ",
                        address.substr(0, scheme + 3),
                        "; --tls-ca asks for an encrypted connection");
  }
  const std::optional<HostPort> parts = ParseHostPort(address);
  if (parts && parts->port > 0 &&
      address.find_first_of("/ \t") == std::string::npos) {
    return "";
  }
  return absl::StrCat("'", address, "', expected HOST:PORT");
}

// Returns the content of a PEM file, "" for no file. gRPC says nothing useful
// about a file that is none.
absl::StatusOr<std::string> LoadPem(absl::string_view flag,
                                    const std::string& path,
                                    absl::string_view label) {
  if (path.empty()) return "";
  const std::string what = absl::StrCat("PEM with a ", label, " for ", flag);
  ISOMATCH_ASSIGN_OR_RETURN(std::string pem, ReadFile(path, what));
  if (absl::StrContains(pem, "-----BEGIN ") &&
      absl::StrContains(pem,
                        absl::StrCat(absl::AsciiStrToUpper(label), "-----"))) {
    return pem;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': expected ", what));
}

absl::StatusOr<std::string> LoadKey(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text,
                            ReadFile(path, "an API key for --api-key-file"));
  std::vector<std::string> keys;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const absl::string_view word = absl::StripAsciiWhitespace(line);
    if (!word.empty() && word[0] != '#') keys.emplace_back(word);
  }
  if (keys.size() == 1 && IsApiKeyText(keys[0])) return keys[0];
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': expected one line with an API key"));
}

absl::StatusOr<std::string> ChooseKey(const ConnectionFlags& flags,
                                      const char* environment_key) {
  if (!flags.api_key_file.empty()) return LoadKey(flags.api_key_file);
  const std::string key = environment_key == nullptr ? "" : environment_key;
  if (key.empty() || IsApiKeyText(key)) return key;
  return absl::InvalidArgumentError(
      absl::StrCat(kEnvironmentKey, ": expected an API key without blanks"));
}

}  // namespace

void AddConnectionFlags(CLI::App* command, ConnectionFlags* flags,
                        ServerUse use) {
  if (use == ServerUse::kNeeded) flags->server = kDefaultServer;
  CLI::Option* server =
      command
          ->add_option("--server", flags->server,
                       "Address of a running isomatch-server, "
                       "or of several that share their jobs: "
                       "IP:PORT,IP:PORT,...")
          ->envname("ISOMATCH_SERVER")
          ->check(CLI::Validator(CheckAddress, ""))
          ->type_name("HOST:PORT");
  CLI::Option* ca =
      command
          ->add_option("--tls-ca", flags->tls_ca,
                       "PEM file of the authorities that vouch for the "
                       "server; with it the connection is encrypted")
          ->type_name(kFile);
  CLI::Option* certificate =
      command
          ->add_option("--tls-cert", flags->tls_cert,
                       "PEM file of your certificate, where the server asks")
          ->type_name(kFile)
          ->needs(ca);
  CLI::Option* key = command
                         ->add_option("--tls-key", flags->tls_key,
                                      "PEM file of its private key")
                         ->type_name(kFile)
                         ->needs(certificate);
  certificate->needs(key);
  CLI::Option* api_key =
      command
          ->add_option("--api-key-file", flags->api_key_file,
                       "File with your API key in one line; without it the "
                       "environment's ISOMATCH_API_KEY is taken")
          ->type_name(kFile);
  CLI::Option* patience =
      command
          ->add_option("--patience", flags->patience,
                       "How long to try again while the server is away; one "
                       "that never answered has 3 s, unless this is longer "
                       "than 10 s")
          ->type_name("DURATION")
          ->capture_default_str();
  SetGroup(command, kServerGroup,
           {"--server", "--tls-ca", "--tls-cert", "--tls-key", "--api-key-file",
            "--patience"});
  if (use == ServerUse::kNeeded) {
    server->capture_default_str();
  } else {
    ca->needs(server);
    api_key->needs(server);
    patience->needs(server);
  }
}

absl::StatusOr<ConnectionSecurity> LoadSecurity(const ConnectionFlags& flags,
                                                const char* environment_key) {
  ConnectionSecurity security;
  ISOMATCH_ASSIGN_OR_RETURN(security.ca_pem,
                            LoadPem("--tls-ca", flags.tls_ca, "certificate"));
  ISOMATCH_ASSIGN_OR_RETURN(
      security.certificate_pem,
      LoadPem("--tls-cert", flags.tls_cert, "certificate"));
  ISOMATCH_ASSIGN_OR_RETURN(security.key_pem,
                            LoadPem("--tls-key", flags.tls_key, "private key"));
  ISOMATCH_ASSIGN_OR_RETURN(security.api_key,
                            ChooseKey(flags, environment_key));
  return security;
}

absl::StatusOr<absl::Duration> ParsePatience(const ConnectionFlags& flags) {
  absl::Duration duration;
  if (absl::ParseDuration(flags.patience, &duration) &&
      duration >= absl::ZeroDuration() && duration < absl::InfiniteDuration()) {
    return duration;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--patience is '", flags.patience,
                   "', expected a duration, e.g. 0s, 30s or 10m"));
}

std::vector<std::string> SecurityWarnings(const ConnectionFlags& flags,
                                          const ConnectionSecurity& security) {
  if (security.api_key.empty() || !security.ca_pem.empty() ||
      IsLoopbackAddress(flags.server)) {
    return {};
  }
  return {absl::StrCat("the API key travels unencrypted to ", flags.server,
                       ", expected --tls-ca")};
}

}  // namespace isomatch

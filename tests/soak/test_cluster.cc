#include "tests/soak/test_cluster.h"

#include <csignal>
#include <utility>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <pqxx/pqxx>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/file_descriptor.h"

namespace isomatch {
namespace {

/// A port that is free now, and that nobody is given by chance soon.
int FreePort() {
  const FileDescriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(bind(socket.get(), generic, size), 0);
  EXPECT_EQ(getsockname(socket.get(), generic, &size), 0);
  return ntohs(address.sin_port);
}

std::string AddressOf(int port) { return absl::StrCat("127.0.0.1:", port); }

std::unique_ptr<PostgresServer> StartDatabase() {
  auto server = PostgresServer::Start();
  if (server.ok()) return *std::move(server);
  ADD_FAILURE() << server.status();
  return nullptr;
}

}  // namespace

TestCluster::Process::Process(const std::vector<std::string>& flags)
    : process_(ISOMATCH_SERVER_BINARY, flags),
      log_reader_([this] { process_.ReadLines(); }) {}

TestCluster::Process::~Process() {
  if (process_.id() > 0) End(SIGKILL);
  log_reader_.join();
}

void TestCluster::Process::End(int signal) {
  process_.Signal(signal);
  process_.Signal(SIGCONT);
  process_.ExitStatus();
}

TestCluster::TestCluster(Options options)
    : options_(std::move(options)),
      database_(StartDatabase()),
      database_url_(database_->url()),
      store_(options_.store.empty() ? database_url_ : options_.store) {
  ChildProcess migrate(ISOMATCH_SERVER_BINARY, {"migrate", "--store", store_},
                       "/dev/null");
  EXPECT_EQ(migrate.ExitStatus(), 0);
  for (int i = 0; i < options_.gateways; ++i) {
    ports_.push_back(FreePort());
    gateways_.emplace_back();
    stubs_.emplace_back();
    StartGateway(static_cast<size_t>(i));
  }
  for (int i = 0; i < options_.workers; ++i) {
    workers_.emplace_back();
    StartWorker(static_cast<size_t>(i));
  }
}

TestCluster::~TestCluster() = default;

std::unique_ptr<TestCluster::Process> TestCluster::Start(
    std::vector<std::string> own) const {
  std::vector<std::string> flags = {"--store", store_, "--metrics-listen",
                                    "off"};
  flags.insert(flags.end(), own.begin(), own.end());
  flags.insert(flags.end(), options_.flags.begin(), options_.flags.end());
  return std::make_unique<Process>(flags);
}

void TestCluster::StartGateway(size_t gateway) {
  const std::string address = AddressOf(ports_[gateway]);
  gateways_[gateway] = Start({"--role", "gateway", "--listen", address});
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 100);
  const auto channel = grpc::CreateCustomChannel(
      address, grpc::InsecureChannelCredentials(), arguments);
  EXPECT_TRUE(channel->WaitForConnected(
      absl::ToChronoTime(absl::Now() + absl::Seconds(30))));
  stubs_[gateway] = v1::CorrespondenceService::NewStub(channel);
}

void TestCluster::StartWorker(size_t worker) {
  workers_[worker] = Start({"--role", "worker", "--threads-per-job", "1"});
}

std::string TestCluster::addresses() const {
  return absl::StrJoin(ports_, ",", [](std::string* text, int port) {
    absl::StrAppend(text, AddressOf(port));
  });
}

void TestCluster::KillGateway(int gateway) {
  const auto index = static_cast<size_t>(gateway);
  gateways_[index]->End(SIGKILL);
  StartGateway(index);
}

void TestCluster::KillWorker(int worker, int signal) {
  const auto index = static_cast<size_t>(worker);
  workers_[index]->End(signal);
  StartWorker(index);
}

void TestCluster::SignalWorker(int worker, int signal) const {
  workers_[static_cast<size_t>(worker)]->Signal(signal);
}

void TestCluster::KillDatabase() {
  database_->Kill();
  const absl::Status restarted = database_->Restart();
  EXPECT_TRUE(restarted.ok()) << restarted;
}

void TestCluster::CutConnections() {
  Ask("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
      "WHERE application_name = 'isomatch' AND pid <> pg_backend_pid()");
}

std::string TestCluster::Ask(const std::string& sql) const {
  try {
    pqxx::connection connection(database_url_);
    pqxx::nontransaction database(connection);
    const pqxx::result rows = database.exec(sql);
    return rows.empty() ? "" : rows[0][0].as<std::string>("");
  } catch (const pqxx::failure& error) {
    ADD_FAILURE() << sql << ": " << error.what();
    return "";
  }
}

}  // namespace isomatch

// Fast DDS as the other side, as rmw_fastrtps_cpp uses it: raw samples in and out, requests and replies
// related by the identity in RTPS. Driven line by line; bytes are hexadecimal CDR with its header.
//
//   in:  reader TOPIC TYPE reliable|best_effort volatile|latched
//        writer TOPIC TYPE reliable|best_effort volatile|latched
//        client REQUESTS TYPE REPLIES TYPE
//        write TOPIC BYTES
//        greet TOPIC TYPE reliable|best_effort volatile|latched BYTES
//        ask REQUESTS NUMBER BYTES
//        server REQUESTS TYPE REPLIES TYPE
//        answer REQUESTS NUMBER BYTES
// `greet` makes a writer that writes as soon as it is matched, and is gone before Fast DDS would send again by itself.
//
//   out: matched TOPIC | refused TOPIC | sample TOPIC BYTES | reply REQUESTS NUMBER BYTES | greeted TOPIC |
//        request REQUESTS NUMBER BYTES
//
// Arguments are the domain and, where it is secured, the folder of an enclave.

#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/common/WriteParams.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SampleIdentity;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::rtps::WriteParams;

struct Raw {
  std::vector<unsigned char> bytes;
};

// Largest sample that is taken.
constexpr uint32_t kMostBytes = 1 << 20;

class RawType : public TopicDataType {
 public:
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = kMostBytes;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& bytes = static_cast<Raw*>(data)->bytes;
    std::copy(bytes.begin(), bytes.end(), payload->data);
    payload->length = bytes.size();
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<Raw*>(data)->bytes.assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<uint32_t>(static_cast<Raw*>(data)->bytes.size()); };
  }
  void* createData() override { return new Raw; }
  void deleteData(void* data) override { delete static_cast<Raw*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

static std::mutex output;

static void say(const std::string& line) {
  std::lock_guard<std::mutex> alone(output);
  std::cout << line << std::endl;
}

static std::string hexadecimal(const std::vector<unsigned char>& bytes) {
  static const char digits[] = "0123456789abcdef";
  std::string text;
  for (unsigned char byte : bytes) {
    text += digits[byte >> 4];
    text += digits[byte & 15];
  }
  return text;
}

static std::vector<unsigned char> bytes_of(const std::string& text) {
  std::vector<unsigned char> bytes;
  for (size_t at = 0; at + 1 < text.size(); at += 2) {
    bytes.push_back(std::stoi(text.substr(at, 2), nullptr, 16));
  }
  return bytes;
}

// Tells samples; of replies those to its own requests.
class Hearing : public DataReaderListener {
 public:
  Hearing(std::string topic, std::string requests) : topic_(topic), requests_(requests) {}
  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    if (status.current_count_change > 0) say("matched " + topic_);
  }
  void on_data_available(DataReader* reader) override {
    Raw sample;
    SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      if (requests_.empty()) {
        say("sample " + topic_ + " " + hexadecimal(sample.bytes));
        continue;
      }
      const auto& asked = info.related_sample_identity;
      if (asked.writer_guid() != reader->guid()) continue;
      std::lock_guard<std::mutex> alone(mutex);
      const auto found = numbers.find(asked.sequence_number().to64long());
      if (found == numbers.end()) continue;
      say("reply " + requests_ + " " + std::to_string(found->second) + " " + hexadecimal(sample.bytes));
    }
  }
  std::mutex mutex;
  std::map<int64_t, int64_t> numbers;

 private:
  std::string topic_, requests_;
};

// Tells requests, and keeps to whom each is answered: to its writer, or, as rmw_fastrtps_cpp does, to the reader of
// replies that it names.
class Serving : public DataReaderListener {
 public:
  explicit Serving(std::string requests) : requests_(requests) {}
  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    if (status.current_count_change > 0) say("matched " + requests_);
  }
  void on_data_available(DataReader* reader) override {
    Raw sample;
    SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      SampleIdentity asked = info.sample_identity;
      const auto& reader_of_replies = info.related_sample_identity.writer_guid();
      if (reader_of_replies != GUID_t::unknown()) asked.writer_guid() = reader_of_replies;
      std::lock_guard<std::mutex> alone(mutex);
      asked_.push_back(asked);
      say("request " + requests_ + " " + std::to_string(asked_.size()) + " " + hexadecimal(sample.bytes));
    }
  }
  SampleIdentity asked(size_t number) {
    std::lock_guard<std::mutex> alone(mutex);
    return asked_.at(number - 1);
  }

 private:
  std::mutex mutex;
  std::string requests_;
  std::vector<SampleIdentity> asked_;
};

class Speaking : public DataWriterListener {
 public:
  explicit Speaking(std::string topic) : topic_(topic) {}
  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    if (status.current_count_change > 0) say("matched " + topic_);
  }

 private:
  std::string topic_;
};

// The files of an enclave as rmw_fastrtps_cpp gives them to Fast DDS.
static void secure(DomainParticipantQos& qos, const std::string& enclave) {
  auto& properties = qos.properties().properties();
  const auto set = [&](const std::string& name, const std::string& value) {
    properties.emplace_back(name, value);
  };
  const auto file = [&](const std::string& name) { return "file://" + enclave + "/" + name; };
  const std::string identity = "dds.sec.auth.builtin.PKI-DH.";
  set("dds.sec.auth.plugin", "builtin.PKI-DH");
  set(identity + "identity_ca", file("identity_ca.cert.pem"));
  set(identity + "identity_certificate", file("cert.pem"));
  set(identity + "private_key", file("key.pem"));
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  set("dds.sec.access.plugin", "builtin.Access-Permissions");
  set(access + "permissions_ca", file("permissions_ca.cert.pem"));
  set(access + "governance", file("governance.p7s"));
  set(access + "permissions", file("permissions.p7s"));
  set("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

class Peer {
 public:
  Peer(int domain, const std::string& enclave) {
    DomainParticipantQos qos;
    if (!enclave.empty()) secure(qos, enclave);
    qos.name("fast_dds_peer");
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    participant_ = DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    if (participant_ == nullptr) throw std::runtime_error("no participant");
    publisher_ = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  }

  Hearing* read(const std::string& name, const std::string& type, bool reliable, bool latched,
                const std::string& requests) {
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    set(qos, reliable, latched, 1000);
    auto* hearing = new Hearing(name, requests);
    hear(name, type, qos, hearing);
    return hearing;
  }

  void write_to(const std::string& name, const std::string& type, bool reliable, bool latched) {
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    set(qos, reliable, latched, 100);
    auto* writer = publisher_->create_datawriter(topic(name, type), qos, new Speaking(name));
    if (writer == nullptr) return say("refused " + name);
    writers_[name] = writer;
  }

  void client(const std::string& requests, const std::string& request, const std::string& replies,
              const std::string& reply) {
    clients_[requests] = {replies, read(replies, reply, true, false, requests)};
    write_to(requests, request, true, false);
  }

  void server(const std::string& requests, const std::string& request, const std::string& replies,
              const std::string& reply) {
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    set(qos, true, false, 1000);
    auto* serving = new Serving(requests);
    servers_[requests] = {replies, serving};
    write_to(replies, reply, true, false);
    hear(requests, request, qos, serving);
  }

  void answer(const std::string& requests, size_t number, const std::string& text) {
    Raw sample{bytes_of(text)};
    auto& [replies, serving] = servers_.at(requests);
    WriteParams parameters;
    parameters.related_sample_identity(serving->asked(number));
    writers_.at(replies)->write(&sample, parameters);
  }

  void write(const std::string& name, const std::string& text) {
    Raw sample{bytes_of(text)};
    writers_.at(name)->write(&sample);
  }

  // As `ros2 topic pub --once`, whose writer is gone after 0.1 s. Here it stays for 1 s, so that a computer that stands
  // still for a moment is no loss; by itself Fast DDS would send the sample again after 3 s.
  void greet(const std::string& name, const std::string& type, bool reliable, bool latched,
             const std::string& text) {
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    set(qos, reliable, latched, 1);
    auto* writer = publisher_->create_datawriter(topic(name, type), qos);
    if (writer == nullptr) return say("refused " + name);
    PublicationMatchedStatus status;
    do {
      writer->get_publication_matched_status(status);
    } while (status.current_count == 0);
    Raw sample{bytes_of(text)};
    writer->write(&sample);
    std::this_thread::sleep_for(std::chrono::seconds(1));
    publisher_->delete_datawriter(writer);
    say("greeted " + name);
  }

  // As rmw_fastrtps_cpp sends a request: related to its reader of replies.
  void ask(const std::string& requests, int64_t number, const std::string& text) {
    Raw sample{bytes_of(text)};
    auto& [replies, hearing] = clients_.at(requests);
    WriteParams parameters;
    parameters.related_sample_identity().writer_guid() = readers_.at(replies)->guid();
    std::lock_guard<std::mutex> alone(hearing->mutex);
    writers_.at(requests)->write(&sample, parameters);
    hearing->numbers[parameters.sample_identity().sequence_number().to64long()] = number;
  }

 private:
  template <class Qos>
  static void set(Qos& qos, bool reliable, bool latched, int depth) {
    qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = depth;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
    qos.data_sharing().off();
  }

  void hear(const std::string& name, const std::string& type, const DataReaderQos& qos,
            DataReaderListener* listener) {
    auto* reader = subscriber_->create_datareader(topic(name, type), qos, listener);
    if (reader == nullptr) throw std::runtime_error("no reader of " + name);
    readers_[name] = reader;
  }

  Topic* topic(const std::string& name, const std::string& type) {
    auto*& known = topics_[name];
    if (known == nullptr) {
      TypeSupport support(new RawType(type));
      support.register_type(participant_);
      known = participant_->create_topic(name, type, TOPIC_QOS_DEFAULT);
      if (known == nullptr) throw std::runtime_error("no topic " + name);
    }
    return known;
  }

  DomainParticipant* participant_;
  Publisher* publisher_;
  Subscriber* subscriber_;
  std::map<std::string, Topic*> topics_;
  std::map<std::string, DataReader*> readers_;
  std::map<std::string, DataWriter*> writers_;
  std::map<std::string, std::pair<std::string, Hearing*>> clients_;
  std::map<std::string, std::pair<std::string, Serving*>> servers_;
};

int main(int count, char** arguments) {
  Peer peer(std::stoi(arguments[1]), count > 2 ? arguments[2] : "");
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string verb, a, b, c, d, e;
    words >> verb >> a >> b >> c >> d;
    if (verb == "reader") peer.read(a, b, c == "reliable", d == "latched", "");
    if (verb == "writer") peer.write_to(a, b, c == "reliable", d == "latched");
    if (verb == "client") peer.client(a, b, c, d);
    if (verb == "write") peer.write(a, b);
    if (verb == "greet") {
      words >> e;
      peer.greet(a, b, c == "reliable", d == "latched", e);
    }
    if (verb == "ask") peer.ask(a, std::stoll(b), c);
    if (verb == "server") peer.server(a, b, c, d);
    if (verb == "answer") peer.answer(a, std::stoul(b), c);
  }
  // The participant goes with the process.
  std::_Exit(0);
}
